"""The dashboard: small modules for the browser, served as they are."""
