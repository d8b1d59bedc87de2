"""What the controller drives: robot models and the arms simulated from them."""
