"""What a person sees and touches: shows states, sends commands, computes nothing."""
