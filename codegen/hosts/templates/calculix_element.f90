! A tetrahedron of 4 nodes that asks @FUNCTION@ for stress and modulus, as CalculiX does.
! Its interface is that of UEL, so that the small host can test and solve with it.
subroutine uel(rhs, amatrx, svars, energy, ndofel, nrhs, nsvars, props, nprops, coords, mcrd, &
    nnode, u, du, v, a, jtype, time, dtime, kstep, kinc, jelem, params, ndload, jdltyp, adlmag, &
    predef, npredf, lflags, mlvarx, ddlmag, mdload, pnewdt, jprops, njprop, period)
  use tetrahedron
  implicit none
  logical, parameter :: small = @small@
  integer :: ndofel, nrhs, nsvars, nprops, mcrd, nnode, jtype, kstep, kinc, jelem, ndload
  integer :: npredf, mlvarx, mdload, njprop, lflags(*), jdltyp(*), jprops(*)
  real(real8) :: rhs(ndofel), amatrx(ndofel, ndofel), svars(*), energy(8), props(nprops)
  real(real8) :: coords(3, 4), u(3, 4), du(*), v(*), a(*), time(2), dtime, params(*), adlmag(*)
  real(real8) :: predef(*), ddlmag(*), pnewdt, period
  real(real8) :: g(3, 4), f(3, 3), stress(6), modulus(6, 6), strain(6), tangent, weight
  real(real8) :: cut
  integer :: n, m, i, j, k, l
  rhs = 0; amatrx = 0
  call geometry(coords, g, weight)
  f = matmul(u, transpose(g))
  do i = 1, 3
    f(i, i) = f(i, i) + 1
  end do
  call green(f, strain)
  if (small) f = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])
  cut = 1
  call material(strain, f, stress, modulus, props, nprops, svars, nsvars, time, dtime, cut)
  pnewdt = min(pnewdt, cut)
  if (cut < 1) return
  do n = 1, 4
    do i = 1, 3
      do j = 1, 3
        rhs(3 * n - 3 + i) = rhs(3 * n - 3 + i) - weight * dot_product(f(i, :), stress(at(:, j))) &
          * g(j, n)
      end do
    end do
    do m = 1, 4
      do i = 1, 3
        do k = 1, 3
          tangent = 0
          do j = 1, 3
            do l = 1, 3
              tangent = tangent + g(j, n) * g(l, m) * (dot_product(f(i, :), &
                matmul(modulus(at(:, j), at(:, l)), f(k, :))))
              if (i == k .and. .not. small) tangent = tangent + g(j, n) * g(l, m) * stress(at(j, l))
            end do
          end do
          amatrx(3 * n - 3 + i, 3 * m - 3 + k) = amatrx(3 * n - 3 + i, 3 * m - 3 + k) &
            + weight * tangent
        end do
      end do
    end do
  end do

contains

  ! Green strain, or the small one.
  subroutine green(f, strain)
    real(real8), intent(in) :: f(3, 3)
    real(real8), intent(out) :: strain(6)
    real(real8) :: e(3, 3)
    e = (f + transpose(f)) / 2
    if (.not. small) e = (matmul(transpose(f), f) + reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])) / 2
    strain = [e(1, 1) - 1, e(2, 2) - 1, e(3, 3) - 1, e(1, 2), e(1, 3), e(2, 3)]
  end subroutine

  ! The call of the library, whose 21 moduli are columns of the upper triangle.
  subroutine material(strain, f, stress, modulus, props, nprops, statev, nstatv, time, dtime, pnewdt)
    integer, intent(in) :: nprops, nstatv
    real(real8), intent(in) :: strain(6), f(3, 3), props(nprops), time(2), dtime
    real(real8), intent(out) :: stress(6), modulus(6, 6)
    real(real8), intent(inout) :: pnewdt, statev(nstatv)
    real(real8) :: none(9), packed(21), states(nstatv, 2, 2), after(nstatv, 2, 2)
    integer :: zero(2), i, j, n
    character(80) :: name
    interface
      subroutine law(amat, iel, iint, kode, props, strain, strain0, beta, f0, voj, f1, vj, ithermal, &
          temperature, dtime, time, ttime, icmd, ielas, mi, nstatv, statev0, statev1, stress, &
          stiffness, iorien, pgauss, orab, pnewdt, ipkon, length) bind(c, name='@FUNCTION@')
        import :: real8
        character, intent(in) :: amat(*)
        integer, intent(in) :: iel, iint, kode, ithermal(*), icmd, ielas, mi(*), nstatv, iorien
        integer, intent(in) :: ipkon(*)
        integer, value :: length
        real(real8), intent(in) :: props(*), strain(*), strain0(*), beta(*), f0(3, 3), voj, f1(3, 3)
        real(real8), intent(in) :: vj, temperature, dtime, time, ttime, statev0(*), pgauss(*)
        real(real8), intent(in) :: orab(*)
        real(real8) :: statev1(*), stress(*), stiffness(*), pnewdt
      end subroutine
    end interface
    none = 0; zero = 0; stress = 0; packed = 7; name = '@FUNCTION@'; modulus = 0
    states = 7; states(:, 2, 2) = statev; after = states ! those of point 2 of element 2
    call law(name, 2, 2, -100 - nprops, props, strain, none, none, f, 1d0, f, 1d0, zero, 0d0, dtime, &
      time(1), 0d0, 0, 0, [2], nstatv, states, after, stress, packed, 0, none, none, pnewdt, zero, 80)
    statev = after(:, 2, 2)
    n = 0
    do j = 1, 6
      do i = 1, j
        n = n + 1
        modulus(i, j) = packed(n); modulus(j, i) = packed(n)
      end do
    end do
  end subroutine
end subroutine
