"""How well contacts resist disturbances: wrenches, their hull, quality measures."""
