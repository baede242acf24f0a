"""JSON Schemas and the reference page, generated from the declarations."""
