"use strict";

const variants = find("#variants");
if (variants) sortable(variants);
