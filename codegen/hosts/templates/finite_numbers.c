/* True for numbers; looks at the bits, so that no option of a compiler takes it away. */
static int finite_numbers(const double *values, int count)
{
    for (int k = 0; k < count; ++k) {
        uint64_t bits;
        memcpy(&bits, values + k, sizeof bits);
        if ((bits >> 52 & 0x7ff) == 0x7ff)
            return 0;
    }
    return 1;
}
