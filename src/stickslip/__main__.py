"""``python -m stickslip``: the command line."""

from stickslip.cli.program import main

if __name__ == "__main__":
    main(prog_name="stickslip")
