"""Proofs that missions never hang, crash or leave the contract; each is a long run that can be resumed."""
