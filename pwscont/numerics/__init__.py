"""Floor 2: linear algebra and the parts of one continuation step."""
