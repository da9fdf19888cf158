"""Parts of a page: sections, tables, drawings, and the words and units of figures, for any procedure."""
