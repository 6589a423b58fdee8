"""The language of expressions over signals.

Read, bound to names, computed over batches of rows, the same however they are cut.
"""
