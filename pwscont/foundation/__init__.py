"""Floor 0: the nouns that everything else is made of."""
