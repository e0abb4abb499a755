"""The lab: a page in the browser, on this machine alone, that plays with systems and asks records."""
