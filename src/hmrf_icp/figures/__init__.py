"""Pictures of registrations and of residuals."""
