"""What is done with images after rendering: facts, comparison, false colour, denoising."""
