"""The report, and the tables of pages and of the console."""
