"""What a page is made of: sections, tables, drawings, and the words and units of figures. Knows no procedure."""
