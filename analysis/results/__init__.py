"""What a folder of results holds: read, checked, and told as numbers a person reads."""
