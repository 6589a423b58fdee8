"""Past samples.

Rows and columns straight from the buffers, pins that keep them, and the moments one looks for in them.
"""
