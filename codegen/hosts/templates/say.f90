  subroutine say(what, error, limit)
    character(*), intent(in) :: what
    real(real8), intent(in) :: error, limit
    character(6) :: word
    word = 'ok'
    if (.not. error <= limit) word = 'FAILED'
    if (.not. error <= limit) failures = failures + 1
    print '(a36, 1x, es7.1e2, 2x, a)', what // repeat(' ', 36), error, trim(word)
  end subroutine
