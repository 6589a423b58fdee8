"""What the screens show, as plain Python and NumPy. Nothing in here knows Textual or Zenoh."""
