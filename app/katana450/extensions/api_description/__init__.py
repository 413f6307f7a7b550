"""Description of the API for programs, as OpenAPI."""
