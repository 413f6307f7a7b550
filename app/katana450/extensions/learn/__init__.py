"""Environments of gymnasium, in which a policy drives the arm as a person does."""
