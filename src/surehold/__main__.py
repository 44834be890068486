"""`python -m surehold` is the command `surehold`."""

from surehold.cli import main

if __name__ == "__main__":
    main()
