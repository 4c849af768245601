"""The default: many candidates round the loop, judged by what the sensors saw."""
