"""Many captures: pairing, plan, record, workers, summary. Imports nothing, so that workers start fast."""
