"""How a client asks a logger for something: what a request is and how it is declared, who does it, what is refused.

Knows neither the network nor any request of its own: features declare theirs (`requests.py` in their folders).
"""
