"""The nouns and rules that all of silo shares: what elements are, errors, arguments, names, quantities.

None of it loads NumPy.
"""
