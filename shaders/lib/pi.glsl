const float PI = 3.141592653589793;
