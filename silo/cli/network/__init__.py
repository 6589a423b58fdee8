"""Commands on ways to other computers."""
