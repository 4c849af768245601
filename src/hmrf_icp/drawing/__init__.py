"""What pictures are made of: colours with one meaning each, lit surfaces, a painter of points."""
