// A double that counts: a contestant's C is compiled with it in place of `double` and run once.
// Every operation counts one, also a division, a root, a power, a logarithm; so does a change of
// sign, but no copy, conversion, comparison or absolute value.
#pragma once
#define SOFTEHL_SOURCE  // the header gives what the kernels are made of, too
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

static long long counted_operations = 0;

struct Counted {
    double v;
    Counted() = default;
    Counted(double a) : v(a) {}
    Counted(float a) : v(a) {}
    Counted(int a) : v(a) {}
    Counted(long long a) : v((double)a) {}
    Counted &operator+=(Counted b) { ++counted_operations; v += b.v; return *this; }
    Counted &operator-=(Counted b) { ++counted_operations; v -= b.v; return *this; }
    Counted &operator*=(Counted b) { ++counted_operations; v *= b.v; return *this; }
    Counted &operator/=(Counted b) { ++counted_operations; v /= b.v; return *this; }
    friend Counted operator+(Counted a, Counted b) { return a += b; }
    friend Counted operator-(Counted a, Counted b) { return a -= b; }
    friend Counted operator*(Counted a, Counted b) { return a *= b; }
    friend Counted operator/(Counted a, Counted b) { return a /= b; }
    friend Counted operator-(Counted a) { ++counted_operations; return -a.v; }
    friend Counted operator+(Counted a) { return a; }
    friend bool operator<(Counted a, Counted b) { return a.v < b.v; }
    friend bool operator>(Counted a, Counted b) { return a.v > b.v; }
    friend bool operator<=(Counted a, Counted b) { return a.v <= b.v; }
    friend bool operator>=(Counted a, Counted b) { return a.v >= b.v; }
    friend bool operator==(Counted a, Counted b) { return a.v == b.v; }
    friend bool operator!=(Counted a, Counted b) { return a.v != b.v; }
    friend bool operator!(Counted a) { return a.v == 0; }
    friend Counted fabs(Counted a) { return std::fabs(a.v); }
};

#define COUNTED_1(NAME) \
    static inline Counted NAME(Counted a) { ++counted_operations; return std::NAME(a.v); }
COUNTED_1(sqrt)
COUNTED_1(cbrt)
COUNTED_1(log)
COUNTED_1(exp)
COUNTED_1(sin)
COUNTED_1(cos)
static inline Counted pow(Counted a, Counted e) { ++counted_operations; return std::pow(a.v, e.v); }

#define double Counted
#define restrict __restrict__
#define _Complex
// The lanes of vector extensions are one element each: count without them.
#undef __GNUC__
