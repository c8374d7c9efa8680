"""Proofs that missions never hang, crash or leave the contract."""
