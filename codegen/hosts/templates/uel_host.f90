! A small host for the user element of @name@: calls UEL as Abaqus/Standard does.
! Checks values of the page and differences, then solves a patch by Newton's method.
! With the argument `again` each increment is computed twice: the first result is rolled back.
program host
  implicit none
  integer, parameter :: real8 = kind(1d0)
  integer :: failures = 0
  call check_samples()
  call solve_patch()
  if (failures > 0) stop 1

contains

  ! The call of one element; lflags(3) = asked.
  subroutine element(asked, u, du, coords, props, svars, time, dt, rhs, amatrx, pnewdt)
    integer, intent(in) :: asked
    real(real8), intent(in) :: u(:), du(:), coords(:, :), props(:), time, dt
    real(real8), intent(inout) :: svars(:), pnewdt
    real(real8), intent(out) :: rhs(:), amatrx(:, :)
    real(real8) :: energy(8), times(2), none(1), rate(size(u)), predef(2, 1, 64)
    integer :: lflags(5), zero(1), n
    external :: uel
    n = size(u)
    energy = 0; times = time; none = 0; rate = 0; zero = 0; predef = 0
    lflags = [1, 1, asked, 0, 0]
    rhs = 7; amatrx = 7 ! Abaqus promises no zeros
    call uel(rhs, amatrx, svars, energy, n, 1, size(svars), props, size(props), coords, &
      size(coords, 1), size(coords, 2), u, du, rate, rate, 1, times, dt, 1, 1, 1, none, 0, zero, &
      none, predef, 1, lflags, n, none, 0, pnewdt, zero, 0, 1d0)
  end subroutine

@say@
  subroutine check_samples()
    integer :: file, n, nodes, dim, nprops, nsvars, outputs, count, s, j
    real(real8) :: pnewdt, dt, worst(4), largest(3)
    real(real8), allocatable :: u(:), du(:), x(:, :), props(:), old(:), new(:), moved(:)
    real(real8), allocatable :: rhs(:), k(:, :), right(:), left(:), scratch(:, :)
    real(real8), allocatable :: rhs_page(:), k_page(:, :), new_page(:)
    open (newunit=file, file='samples.txt', status='old')
    read (file, *) count, n, nodes, dim, nprops, nsvars, outputs
    allocate (u(n), du(n), x(dim, nodes), props(nprops), old(nsvars), moved(nsvars))
    allocate (new(nsvars), new_page(nsvars))
    allocate (rhs(n), right(n), left(n), k(n, n), scratch(n, n), rhs_page(n), k_page(n, n))
    worst = 0; largest = tiny(1d0)
    do s = 1, count
      read (file, *) dt, x, u, du, props, old, rhs_page, k_page, new_page
      new = old; pnewdt = 1
      call element(1, u, du, x, props, new, 1d0, dt, rhs, k, pnewdt)
      largest = max(largest, [maxval(abs(rhs_page)), maxval(abs(k_page)), &
        maxval([0d0, abs(new_page)])])
      worst(:3) = max(worst(:3), [maxval(abs(rhs - rhs_page)), maxval(abs(k - k_page)), &
        maxval([0d0, abs(new - new_page)])])
      if (any(rhs /= rhs)) worst(1) = huge(1d0)
      if (@differences@) then
        do j = 1, n
          moved = old; u(j) = u(j) + 1d-6; du(j) = du(j) + 1d-6
          call element(5, u, du, x, props, moved, 1d0, dt, right, scratch, pnewdt)
          moved = old; u(j) = u(j) - 2d-6; du(j) = du(j) - 2d-6
          call element(5, u, du, x, props, moved, 1d0, dt, left, scratch, pnewdt)
          u(j) = u(j) + 1d-6; du(j) = du(j) + 1d-6
          worst(4) = max(worst(4), maxval(abs((left - right) / 2d-6 - k(:, j))))
        end do
      end if
      ! not-a-number: the increment is cut, the state stays
      new = old; pnewdt = 1; u(1) = sqrt(-abs(u(1)) - 1)
      call element(1, u, du, x, props, new, 1d0, dt, rhs, k, pnewdt)
      if (any(new /= old) .or. any(rhs /= rhs)) pnewdt = 1
    end do
    close (file)
    call say('RHS', worst(1) / largest(1), @limit@)
    call say('AMATRX', worst(2) / largest(2), @limit@)
    call say('SVARS', worst(3) / largest(3), @limit@)
    call say('AMATRX by differences of RHS', worst(4) / largest(2), @difference@)
    call say('not-a-number cuts the increment', abs(pnewdt - 0.25d0), 0d0)
  end subroutine

  ! Newton's method in equal increments; one that is cut begins again from the state before it.
  subroutine solve_patch()
    integer :: file, nodes, dim, cells, corners, n, equations, nprops, nsvars, held, increments
    integer :: done, cut, iterations, c
    real(real8) :: period, dt, time
    integer, allocatable :: cell(:, :), places(:, :), fixed(:)
    real(real8), allocatable :: x(:, :), props(:), svars(:, :), start(:), u(:), before(:), goal(:)
    real(real8), allocatable :: spoiled(:, :), lost(:)
    character(5) :: word
    logical :: there, good
    call get_command_argument(1, word)
    inquire (file='patch.txt', exist=there)
    if (.not. there) return
    open (newunit=file, file='patch.txt', status='old')
    read (file, *) nodes, dim, cells, corners, n, equations, nprops, nsvars, held, increments, period
    allocate (x(dim, nodes), cell(corners, cells), places(n, cells), props(nprops))
    allocate (start(nsvars), svars(nsvars, cells), fixed(held), goal(held), u(equations))
    read (file, *) x
    do c = 1, cells
      read (file, *) cell(:, c), places(:, c)
    end do
    read (file, *) props, start, u
    do c = 1, held
      read (file, *) fixed(c), goal(c)
    end do
    close (file)
    svars = spread(start, 2, cells)
    before = u(fixed)
    dt = period / increments; time = 0; done = 0; cut = 0
    do while (time < period * (1 - 1d-9))
      if (word == 'again') then
        lost = u; spoiled = svars
        call increment(x, cell, places, props, fixed, before + 2 * (goal - before), time, dt, lost, &
          spoiled, iterations, good)
      end if
      call increment(x, cell, places, props, fixed, before + (goal - before) * (time + dt) / period, &
        time, dt, u, svars, iterations, good)
      if (good) then
        time = time + dt; done = done + 1
        print '(a, i3, a, i3, a)', 'increment', done, ': ', iterations, ' iterations'
      else
        cut = cut + 1; dt = dt / 4
        print '(a)', 'increment cut'
        if (cut > 8) exit
      end if
    end do
    if (abs(time - period) > period * 1d-9) then
      ! a page that holds nothing by itself, such as a spring in one direction, has no solution
      print '(a)', 'left out: the patch has no solution at the values of patch.txt'
      return
    end if
    print '(a)', 'the patch is solved'
    open (newunit=file, file='solution.txt', status='replace')
    write (file, '(es25.17)') u
    write (file, '(es25.17)') svars
    close (file)
  end subroutine

  subroutine increment(x, cell, places, props, fixed, values, time, dt, u, svars, iteration, good)
    real(real8), intent(in) :: x(:, :), props(:), values(:), time, dt
    integer, intent(in) :: cell(:, :), places(:, :), fixed(:)
    real(real8), intent(inout) :: u(:), svars(:, :)
    integer, intent(out) :: iteration
    logical, intent(out) :: good
    real(real8) :: new(size(svars, 1), size(svars, 2)), trial(size(u)), pnewdt, force, residual
    real(real8) :: r(size(u)), k(size(u), size(u)), rhs(size(places, 1)), correction
    real(real8) :: a(size(places, 1), size(places, 1)), pull(size(u))
    integer :: c, i
    trial = u; good = .false.; correction = 1
    do iteration = 0, 25
      new = svars ! every iteration begins from the state before the increment
      r = 0; k = 0; force = 0; pnewdt = 1
      pull = 0; pull(fixed) = values - trial(fixed)
      do c = 1, size(cell, 2)
        associate (p => places(:, c))
          call element(1, trial(p), trial(p) - u(p), x(:, cell(:, c)), props, new(:, c), &
            time + dt, dt, rhs, a, pnewdt)
          if (pnewdt < 1) return
          r(p) = r(p) + rhs
          k(p, p) = k(p, p) + a
          force = max(force, maxval(abs(rhs)))
        end associate
      end do
      if (correction <= 1d-9) then
        u = trial; svars = new; good = .true. ! commit
        return
      end if
      r(fixed) = 0
      residual = maxval(abs(r)) / max(force, tiny(1d0))
      r = r - matmul(k, pull)
      r(fixed) = pull(fixed)
      do i = 1, size(fixed)
        k(fixed(i), :) = 0; k(:, fixed(i)) = 0; k(fixed(i), fixed(i)) = 1
      end do
      call solve(k, r)
      if (any(r /= r)) return
      trial = trial + r
      correction = maxval(abs(r)) / max(maxval(abs(trial)), tiny(1d0))
      print '(a, i3, 2(a, es9.2))', '  iteration', iteration + 1, ': residual', residual, &
        ', correction', correction
    end do
  end subroutine

  ! Gaussian elimination with pivots; the solution replaces b.
  subroutine solve(a, b)
    real(real8), intent(inout) :: a(:, :), b(:)
    integer :: i, j, pivot
    real(real8) :: row(size(b)), one
    do i = 1, size(b)
      pivot = i - 1 + maxloc(abs(a(i:, i)), 1)
      row = a(i, :); a(i, :) = a(pivot, :); a(pivot, :) = row
      one = b(i); b(i) = b(pivot); b(pivot) = one
      do j = i + 1, size(b)
        if (a(j, i) == 0) cycle
        one = a(j, i) / a(i, i)
        a(j, i:) = a(j, i:) - one * a(i, i:)
        b(j) = b(j) - one * b(i)
      end do
    end do
    do i = size(b), 1, -1
      b(i) = (b(i) - dot_product(a(i, i + 1:), b(i + 1:))) / a(i, i)
    end do
  end subroutine
end program

! Abaqus ends the analysis with it.
subroutine xit()
  stop 2
end subroutine
