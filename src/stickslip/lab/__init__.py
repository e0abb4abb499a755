"""The lab: a page in the browser, on this machine alone, that plays with systems and asks records."""

DOORWAY = "open.html"  # in the folder of a run, until a page is open
