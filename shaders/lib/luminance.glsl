// Brightness of a linear colour: Rec. 709, whose primaries sRGB has, too.
float luminance(vec3 c) { return dot(c, vec3(0.2126, 0.7152, 0.0722)); }
