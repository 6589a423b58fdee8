"""What the helper answers to each request: a server per feature, with a method per request.

Pure routing: what is checked and who does it; the work is done in the modules that are called here.
"""
