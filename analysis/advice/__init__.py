"""Which strategy for what: the rule, and the sentences at the top of a report."""
