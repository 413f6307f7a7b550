"""The bridge to viser. Only this package uses private parts of viser's server."""
