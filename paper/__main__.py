"""``python -m paper``."""

import sys

if __name__ == "__main__":
    try:
        from paper.command import main  # here, so that an interrupt while importing ends quietly

        status = main()
    except KeyboardInterrupt:
        status = 130
    sys.exit(status)
