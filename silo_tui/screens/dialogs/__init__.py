"""What is asked: questions, lines, forms."""
