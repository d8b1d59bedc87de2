"""Campaigns: thousands of scenarios in virtual time, on the local cores or a Dask cluster (docs/campaigns.md)."""
