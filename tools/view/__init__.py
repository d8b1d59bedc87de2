"""What a person sees of running robots: the page in the browser, other renderers, the terminal, pictures."""
