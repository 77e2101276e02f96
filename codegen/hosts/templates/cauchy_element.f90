! A tetrahedron of 4 nodes that asks @host_name@ for stress and modulus and integrates them.
! Stress: Cauchy; modulus: of Jaumann's rate of the Kirchhoff stress, over the volume ratio.
! Its interface is that of UEL, so that the small host can test and solve with it.
subroutine uel(rhs, amatrx, svars, energy, ndofel, nrhs, nsvars, props, nprops, coords, mcrd, &
    nnode, u, du, v, a, jtype, time, dtime, kstep, kinc, jelem, params, ndload, jdltyp, adlmag, &
    predef, npredf, lflags, mlvarx, ddlmag, mdload, pnewdt, jprops, njprop, period)
  use tetrahedron
  use material_call
  implicit none
  logical, parameter :: small = @small@
  integer :: ndofel, nrhs, nsvars, nprops, mcrd, nnode, jtype, kstep, kinc, jelem, ndload
  integer :: npredf, mlvarx, mdload, njprop, lflags(*), jdltyp(*), jprops(*)
  real(real8) :: rhs(ndofel), amatrx(ndofel, ndofel), svars(*), energy(8), props(nprops)
  real(real8) :: coords(3, 4), u(3, 4), du(*), v(*), a(*), time(2), dtime, params(*), adlmag(*)
  real(real8) :: predef(*), ddlmag(*), pnewdt, period
  real(real8) :: g(3, 4), f(3, 3), stress(6), modulus(6, 6), strain(6), volume, tangent, weight
  real(real8) :: cut
  integer :: n, m, i, j, k, l
  rhs = 0; amatrx = 0
  call geometry(coords, g, weight)
  f = matmul(u, transpose(g))
  do i = 1, 3
    f(i, i) = f(i, i) + 1
  end do
  strain = [f(1, 1) - 1, f(2, 2) - 1, f(3, 3) - 1, f(1, 2) + f(2, 1), f(1, 3) + f(3, 1), &
    f(2, 3) + f(3, 2)]
  cut = 1
  call material(strain, f, stress, modulus, props, nprops, svars, nsvars, time, dtime, cut)
  pnewdt = min(pnewdt, cut)
  if (cut < 1) return
  volume = 1
  if (.not. small) call push(f, g, volume)
  stress = volume * stress; modulus = volume * modulus
  do n = 1, 4
    do i = 1, 3
      do j = 1, 3
        rhs(3 * n - 3 + i) = rhs(3 * n - 3 + i) - weight * stress(at(i, j)) * g(j, n)
      end do
    end do
    do m = 1, 4
      do i = 1, 3
        do k = 1, 3
          tangent = 0
          do j = 1, 3
            do l = 1, 3
              tangent = tangent + g(j, n) * coefficient(i, j, k, l) * g(l, m)
            end do
          end do
          amatrx(3 * n - 3 + i, 3 * m - 3 + k) = amatrx(3 * n - 3 + i, 3 * m - 3 + k) &
            + weight * tangent
        end do
      end do
    end do
  end do

contains

  ! From the modulus of the Jaumann rate to that of the velocity gradient.
  real(real8) function coefficient(i, j, k, l)
    integer, intent(in) :: i, j, k, l
    coefficient = modulus(at(i, j), at(k, l))
    if (small) return
    if (i == k) coefficient = coefficient + stress(at(j, l)) / 2
    if (j == k) coefficient = coefficient - stress(at(i, l)) / 2
    if (i == l) coefficient = coefficient - stress(at(j, k)) / 2
    if (j == l) coefficient = coefficient - stress(at(i, k)) / 2
  end function

  ! Gradients by the deformed coordinates, and the volume ratio.
  subroutine push(f, g, volume)
    real(real8), intent(in) :: f(3, 3)
    real(real8), intent(inout) :: g(3, 4)
    real(real8), intent(out) :: volume
    real(real8) :: c(3, 3)
    call cofactors(f, c, volume)
    g = matmul(c, g) / volume
  end subroutine
end subroutine
