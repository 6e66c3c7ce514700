/* From here on, the names of arithmetic are those of vectors. */
#undef C
#undef ALIGNED
#undef FMA
#undef FMS
#undef FNMA
#undef FNMS
#undef NOT
#undef AND
#undef OR
#undef TRUE
#undef NUMBER
#undef CHOOSE
#undef FMIN
#undef FMAX
#undef SIGN
#undef LANE
#undef ROOM
#undef D
#undef MD
#undef CD
#undef LANES
#undef FMA_D
#undef SELECT_D
#undef BEYOND
#undef ANY_D
#define V Vector
#define M Mask
#define far_away far_away_lanes
#define SINCOS_D SINCOS_LANES
