  subroutine check_shape(name, array, found, wanted)
    character(*), intent(in) :: name, array
    integer, intent(in) :: found(:), wanted(:)
    character(200) :: text
    if (all(found == wanted)) return
    write (text, '(a, *(i0, :, ", "))') name // ': the shape of ' // array // ' is ', found
    text = trim(text) // ', must be'
    write (text(len_trim(text) + 2:), '(*(i0, :, ", "))') wanted
    error stop trim(text)
  end subroutine
