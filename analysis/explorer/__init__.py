"""The explorer of results: its data (Python), and its page (src, built by `build`)."""
