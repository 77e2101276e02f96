"""Rewrites of the graph that keep its values and lower its cost, and why each of them is sound.

Sound means: wherever the formula before has a real value, the formula after has the same one, for
all arguments.  No pass looks at numbers near one state.  Rounding may differ.

| pass | it uses | why the values stay |
|---|---|---|
| `fold` | the constructors of the graph | x + 0, 1 x, -(-x), log(exp x) = x, exact arithmetic |
| `assume` | conditions of enclosing branches | inside a side its condition is known |
| `powers` | x^(n/2) = sqrt(x)^n, x^(2/3) = x (x^(-1/3))^2 | laws of powers for x > 0; 0 at x = 0 |
| `factor` | a b + a c = a (b + c) | distributive law, on structure |
| `inverses` | 1/x = (x^(-1/3))^3 | only where that root is always computed: x > 0 there |
| `unrolled` | the sum over the points of a rule | its definition; points are right to 60 digits |
| `merge_equal_values` | equality in a prime field | proven for all arguments, to 1e-30 |
| `invariants_first` | order of factors | commutative and associative laws |
| `common_sums` | order of terms, constants taken out | the same laws and the distributive one |
| `literals` | constants to 50 digits, rounded once | they depend on no argument |

The division x (1/x) = 1 of the constructor and some merges give a value where the formula before
has none (at x = 0); none of them takes one away.
"""
