"""Text from outside, as far as the window can show it."""


def showable(text: str) -> str:
    """The text with question marks for what is not Unicode: names of files and in scene files may hold it, and neither
    imgui nor the window's title takes it."""
    return text.encode("utf-8", "replace").decode("utf-8")
