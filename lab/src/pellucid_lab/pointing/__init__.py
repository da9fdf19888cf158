"""Virtual people who point at targets, free and in an exoskeleton."""
