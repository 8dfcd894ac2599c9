def lines(found):
    return [str(found)]
