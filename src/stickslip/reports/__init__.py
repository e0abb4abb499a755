"""One self-contained page from findings, figures and the history of a record."""
