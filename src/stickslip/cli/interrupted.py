"""How Ctrl-C ends the program; without imports, so that it is known before anything else is loaded."""

INTERRUPTED = 130  # exit code of a program that SIGINT ended: 128 + 2
SENTENCE = "stickslip: interrupted; nothing was written."
