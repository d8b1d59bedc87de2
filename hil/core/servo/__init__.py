"""The servo link: applications that start motions and set destinations online."""
