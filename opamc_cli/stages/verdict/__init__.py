"""From scores to verdict.json: agreement, evidence, cause, reasons."""
