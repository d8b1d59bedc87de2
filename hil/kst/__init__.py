"""The KST server: an application beside the controller that does what KST programs ask for over TCP."""
