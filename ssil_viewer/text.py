"""Text from outside, as far as it can be shown and written."""


def showable(text: str) -> str:
    """The text with question marks for what is not Unicode: names of files and in scene files may hold it, and neither
    imgui nor a file in UTF-8 takes it."""
    return text.encode("utf-8", "replace").decode("utf-8")
