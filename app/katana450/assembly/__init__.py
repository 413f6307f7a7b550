"""A running application, put together from its parts."""
