"""Design by hand: a page on this machine on which a layout is dragged, improved and checked."""
