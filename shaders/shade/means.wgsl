// Light around an opaque body: means of what the 4 x 4 pixels around each pixel have seen (shade/around.wgsl).

#import shade/averages.wgsl
#import shade/material.wgsl
