"""What papers print, as data; the same recomputed; and models taken over as published, with what is wrong with them."""
