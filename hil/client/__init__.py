"""What application processes import: clients of the controller's links. Knows neither core nor runtime."""
