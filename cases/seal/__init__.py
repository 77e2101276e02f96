"""The method for lubricated seals: contact, film, path of falling speed, verdict, results."""
