"""Assembly of a running application from its parts."""
