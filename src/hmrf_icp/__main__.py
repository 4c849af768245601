"""``python -m hmrf_icp``: the command line, where scripts are not on the path."""

from hmrf_icp.cli import main

if __name__ == "__main__":
    main()
